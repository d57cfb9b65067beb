"""The parts of the report, one per file, in the order a person reads them."""
