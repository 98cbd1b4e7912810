"""A run of the suite for people and programs: the console, JSON, JUnit XML, and one HTML page with pictures."""
