// Returns its first input plus the second one, with which a test makes it wrong.
void twin() {
    uint word = in_word();
    out_word(word + in_word());
}
