"""What physics a recording shows that the simulator leaves out: where, what, how sure, and what modelling it gains."""
