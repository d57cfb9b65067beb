"""Evaluation on touches anywhere: networks, yardsticks and the bound, by the contacts themselves."""
