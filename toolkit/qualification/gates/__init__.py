"""Every refusal, shown once: what is wrong on purpose must be refused, by the gate that is meant for it."""
