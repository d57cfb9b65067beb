"""What the skin does: mechanics, piezoresistance, conduction, calibration. numpy and scipy only."""
