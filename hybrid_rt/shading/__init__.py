"""Materials, emitters and media at one hit."""
