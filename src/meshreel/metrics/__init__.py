"""How far a decoded sequence is from its original, and what it costs in bits."""
