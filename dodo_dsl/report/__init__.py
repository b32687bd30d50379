"""Outcomes as files: results.json, junit.xml, metrics.txt, index.html and a picture of each drive."""
