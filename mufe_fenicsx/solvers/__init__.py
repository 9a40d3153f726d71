"""Methods of time, Newton's method and eigenvalues, which know no grains."""
