"""CFAR detectors, their thresholds, and how detections are scored."""
