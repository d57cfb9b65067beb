"""The mapping a person begins with: what the file holds in its head, every part explained below."""

from __future__ import annotations

from pathlib import Path

from ertskin.errors import UserError
from ertskin.importing.variables import described, read_variables

BODY = """\
# An entry is a value written here, or taken from the file:
#   {from: NAME}                    a variable; structures with dots (data.meas), CSV columns by name or pattern (v_*)
#   {from: [x, y]}                  several, as the columns of one table
#   {from: NAME, scale: 1.0e-3, offset: 0.0, axes: [1, 0], file: other.csv}
# Units are SI: metre, newton, pascal, ohm, volt, ampere, second. Take out what you don't have.

rig: my bench

# A sheet: size_m [width, height], radius_m of a disk, or outline_m (N,2) counter-clockwise.
sensor:
  size_m: [0.12, 0.12]
  # radius_m: 0.14
  sheet_resistance_ohm_sq: 18.0e+3          # nominal, untouched
  contact_resistance_guess_ohm: 10.0
  # Electrodes on the edge, evenly spread counter-clockwise; first_m: middle of the first one along the outline.
  edge_electrodes: {count: 16, width_m: 0.01, first_m: 0.0, clockwise: false}
  # or pads inside the sheet:
  # electrode_center_m: {from: pads_mm, scale: 1.0e-3}
  # electrode_size_m: [0.004, 0.004]
  # For forces: the pad's layers, top to bottom, and the sensing points.
  # indenter_diameter_m: 0.01
  # layers:
  #   - {name: foam, thickness_m: 4.0e-3, youngs_modulus_pa: 28.0e+3, poissons_ratio: 0.3}
  #   - {name: fabric, thickness_m: 4.0e-4, youngs_modulus_pa: 344.0e+3, poissons_ratio: 0.4}
  # piezo_interface: 0                      # the layer above the piezoresistive interface, counted from 0
  # taxel_grid: [6, 6]

# injection: all, adjacent, or a list of [source, sink]; measurement: sink (every electrode against the sink), adjacent,
# or a list of [plus, minus]; measured: undriven where readings at a driven electrode are not taken (16 x 13).
# counted_from: 1 where lists count electrodes as MATLAB does.
protocol:
  injection: adjacent
  measurement: adjacent
  measured: undriven
  current_a: 1.0e-3
  # scan_s: 0.02
  # adc_limit_v: 10.0

# Or sensor's outline and electrodes and the whole protocol from an EIDORS model (then take out protocol above):
# eidors: {fwd_model: fmdl, metres_per_unit: 0.14}

# voltage_v: frames x injections x readings, or frames x readings in scan order. order: rotating where every injection's
# readings begin at the driven pair. rest: how many frames at the start nothing touches, or {from: NAME} a flag a frame.
frames:
  voltage_v: {from: V}
  order: fixed
  time_s: {step: 0.02}
  rest: 10
  # contact_m: {from: [x_mm, y_mm], scale: 1.0e-3}
  # depth_m: {from: depth_mm, scale: 1.0e-3}
  # force_n: {from: force}

# specimen:
#   stress_pa: {from: stress}
#   sheet_resistance_ohm_sq: {from: resistance}
#   time_s: {from: t}
#   cycle: {from: cycle}
# rigid_block:
#   depth_m: {from: block_depth}
#   force_n: {from: block_force}
# coupon: {time_s: {from: t}, gap_m: {from: gap}, force_n: {from: f}, height_m: 0.01, area_m2: 1.0e-4, lateral: free}
"""


def write_template(path: Path, source: Path | None) -> None:
    """Write the template to ``path``, with what ``source`` holds at its head; never over a file that is there."""
    head = (
        "# Which entry of a file is which field of a recording: ertskin import source=FILE mapping=THIS out=FILE.h5\n"
    )
    if source is not None:
        held = "".join(f"#   {line}\n" for line in described(read_variables(source)))
        head += f"#\n# {source.name} holds\n{held}#\n"
    try:
        with path.open("x", encoding="utf-8") as file:
            file.write(head + BODY)
    except FileExistsError:
        raise UserError(f"{path}: is there already and was left alone; name another: --template=OTHER.yaml") from None
