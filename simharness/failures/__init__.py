"""What is wrong with estimates: classes of failures, and the stage of the method to blame for each."""
