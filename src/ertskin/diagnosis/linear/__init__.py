"""The skin linearised about the states its recording visits."""
