"""What a render needs beside the fibre: grooms."""
