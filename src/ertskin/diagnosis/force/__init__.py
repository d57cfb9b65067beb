"""What force and depth show: the foam's effects and the bench's."""
