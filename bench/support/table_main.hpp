#pragma once

namespace stiction::bench {

/// Runs a benchmark that prints a separate table; main() is in table_main.cpp, where errors become one line and exit
/// status 2.
int run(int argc, char** argv);

}  // namespace stiction::bench
