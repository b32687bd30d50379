"""What a camera on a vehicle sees of a map: shared by the services that draw it or know where its models are."""
