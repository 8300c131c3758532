"""The compiled Sobol sequence, Owen-scrambled by a hash."""
