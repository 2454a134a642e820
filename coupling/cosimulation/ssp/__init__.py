"""Systems of SSP 1.0 and 2.0: what their files hold (structure), read and written."""
