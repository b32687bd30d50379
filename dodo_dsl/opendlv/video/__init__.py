"""Video packets in recordings: decoded and encoded."""
