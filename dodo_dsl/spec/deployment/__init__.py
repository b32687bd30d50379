"""A repository: its ``dodo.yml``, its rigs, and what the operator of a machine permits with them."""
