"""The maker's hand behind its client."""
