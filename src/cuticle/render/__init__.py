"""Scenes of hair in Mitsuba, pictures of them, and samplings compared by what they cost."""
