"""Physics the paper's simulator leaves out, each effect one file at its stage of the forward chain."""
