# install(EXPORT ...): filled by the packaging rules below.
