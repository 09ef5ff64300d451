"""What a maintainer runs once a year: the recorder of the asset pack, pictures of the suite."""
