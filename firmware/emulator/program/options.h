/* The emulator's command line. */
#ifndef OPTIONS_H
#define OPTIONS_H

/* Read the options into the state. Returns the ELF file's path, or NULL when an option is invalid. --help ends the
 * program. */
const char *options_read(int argc, char **argv);

#endif
