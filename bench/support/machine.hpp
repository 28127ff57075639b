#pragma once

#include <string>
#include <utility>
#include <vector>

namespace stiction::bench {

/// Facts beside the program that a number depends on: processor, cores, kernels in use, compiler, flags, commit (from
/// the environment variable STICTION_GIT_ID, which bench/run.sh sets). Pairs of name and value, in a fixed order.
std::vector<std::pair<std::string, std::string>> describe_machine();

/// The command as it was typed, of absolute paths the last name: tables do not depend on folders of a machine.
std::string command_line(int argc, char** argv);

/// CPU time of this process [s]. Unlike the wall clock it does not count the time other programs take, which is why
/// single-threaded measurements use it.
double cpu_seconds();

}  // namespace stiction::bench
