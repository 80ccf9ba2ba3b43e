"""Proofs of robots on legs: closed loops of the compiled controller, many of them, and what they show."""
