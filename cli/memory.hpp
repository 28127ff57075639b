#pragma once

#include <optional>
#include <string>

namespace stiction::cli {

/// Bytes that this process may still take. It is the least of the memory left by the system, by `ulimit -v`, and by
/// its control group's limit. Nothing where the system gives none, which is anywhere but on Linux.
[[nodiscard]] std::optional<double> free_memory();

/// As people read it: "4.1 TB".
[[nodiscard]] std::string bytes_text(double bytes);

/// To be called before anything is allocated: Linux grants more memory than there is and ends the process later.
/// `bytes`: the least need. `what`: the options that ask for it.
/// \throws Error(out_of_memory) that names both if fewer are free.
void require_memory(double bytes, const std::string& what);

}  // namespace stiction::cli
