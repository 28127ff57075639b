#pragma once

#include "cpu_fallback/threads/thread_pool.hpp"

namespace stiction::cpu {

void own_parallel_for(int threads, int items, const ItemWork& work);
void tbb_parallel_for(int threads, int items, const ItemWork& work);

}  // namespace stiction::cpu
