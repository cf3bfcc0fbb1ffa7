"""What every kernel must do with any values: stay within its arrays, and agree with the plain formula at borders."""
