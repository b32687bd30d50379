"""OpenDLV as libcluon 0.0.149 speaks it: messages, the bus, shared memory and recordings."""
