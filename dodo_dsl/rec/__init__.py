"""The work of ``dodo rec``: contents of recordings, cuts, and exports to tables and data sets."""
