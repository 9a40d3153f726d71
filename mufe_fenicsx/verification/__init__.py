"""Cases with a known answer; tests and `mufe verify` call the same functions, in `cases`."""
