"""The independent witness: reads an NC program, simulates it, reports. Imports geometry only."""
