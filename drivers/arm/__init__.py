"""The arm: the model that law and margins are given, and the maker's arm behind its client."""
