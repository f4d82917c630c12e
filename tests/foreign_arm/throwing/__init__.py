"""What a throw needs beside the arm: a ball between fingers, a person who swings, and lessons."""
