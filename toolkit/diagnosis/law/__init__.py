"""Laws: what structure without a name is answered by."""
