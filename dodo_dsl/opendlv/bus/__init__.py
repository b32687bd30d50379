"""The bus: sessions, envelopes, and the kernel's filter for them."""
