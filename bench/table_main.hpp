#pragma once

#include <string>
#include <vector>

namespace stiction::bench {

/// What a benchmark that prints a table of its own does; main() is in table_main.cpp, where errors become one line and
/// exit status 2.
int run(int argc, char** argv);

/// "a,b,c" in parts.
std::vector<std::string> comma_parts(const std::string& text);

}  // namespace stiction::bench
