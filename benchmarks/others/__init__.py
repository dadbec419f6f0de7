"""Cases of other programs and papers, with their published figures beside ours."""
