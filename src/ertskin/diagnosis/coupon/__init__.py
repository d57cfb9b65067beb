"""A foam coupon's compression test alone."""
