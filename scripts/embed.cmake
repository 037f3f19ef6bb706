# Writes the bytes of INPUT as a NUL-terminated array SYMBOL into the C++ source OUTPUT.
file(READ ${INPUT} bytes HEX)
string(REGEX REPLACE "([0-9a-f][0-9a-f])" "static_cast<char>(0x\\1)," bytes "${bytes}")
string(REGEX REPLACE "((static_cast<char>\\(0x..\\),){6})" "\\1\n" bytes "${bytes}")
file(WRITE ${OUTPUT} "extern const char ${SYMBOL}[];\nconst char ${SYMBOL}[] = {\n${bytes}0};\n")
