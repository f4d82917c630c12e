"""What placing needs beside the arm: a part, a holder, a person who carries, and lessons."""
