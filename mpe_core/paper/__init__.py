"""The methods of the paper as it prints them (search "sparse", method "mpe")."""
