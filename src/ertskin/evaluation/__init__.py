"""How well a network finds and weighs touches: metrics, yardsticks, and the run over the test recordings."""
