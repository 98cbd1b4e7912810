/* What every file of kernels begins with. */

#pragma once

#ifdef FIBERS
#include "fibers.h"
#endif
