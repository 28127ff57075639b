#pragma once

#include "stiction/batch.hpp"
#include "stiction/config.hpp"
#include "stiction/contact_graph.hpp"
#include "stiction/error.hpp"
#include "stiction/hash.hpp"
#include "stiction/jacobian.hpp"
#include "stiction/padded.hpp"
#include "stiction/residual.hpp"
#include "stiction/solver.hpp"
#include "stiction/status.hpp"
#include "stiction/types.hpp"
#include "stiction/warm_start.hpp"
