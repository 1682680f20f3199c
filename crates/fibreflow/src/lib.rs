//! The program: case file, command line, time loop, output, checkpoint, report.
