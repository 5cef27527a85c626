"""The work that a program was asked for: the faces that it works on, and stock that it leaves where it could cut."""
