"""Verdicts over both wings: mirrors against truths, and where their difference comes from."""
