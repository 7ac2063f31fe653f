#include "firmware_host/commands/program.hpp"

int main(int argc, char** argv) { return swiftlet::runProgram(argc, argv); }
