#include "firmware_host/commands/command.hpp"

int main(int argc, char** argv) { return swiftlet::runProgram(argc, argv); }
