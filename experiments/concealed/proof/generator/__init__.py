"""Recordings of ERT skins whose physics is written from the literature alone.

Nothing here knows how ``ertskin.physics`` writes its effects: mechanics, conduction, memory, contacts, instrument and
the file's writer are this package's own (numpy, scipy, scikit-fem, h5py). What is shared with the software under test
is the recording format and the baseline its users know of: a linear layered pad under point forces, a fifth-order
polynomial, a complete-electrode sheet.
"""
