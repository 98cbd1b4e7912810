"""Profile `main`: integers from the bits to the splats (spec.md section 15)."""
