"""What to measure next: operating points ranked by how far they separate what recordings leave open."""
