"""From the fits to the answer: what is predicted unseen, how sure each name is, the verdict."""
