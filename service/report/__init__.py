"""Report of a registration: verdict, pictures, pose in all forms, as one page."""
