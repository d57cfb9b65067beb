"""The skin read as it is touched: network without torch, baseline, page, stream."""
