"""What people look at: views, figures, reports."""
