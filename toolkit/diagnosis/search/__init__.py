"""The search: every effect at every place, screened, fitted and judged on runs that no fit has seen."""
