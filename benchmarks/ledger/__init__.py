"""The ledger of all benchmarks: every row, its peer in the same run, the ratio with its spread, and the goal."""
