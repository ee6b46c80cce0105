// Adam (Kingma and Ba, 2015): the decaying means of a gradient and its square. A step goes by their quotient, each divided by
// 1 - decay^steps, which corrects for their beginning at zero.
const float ADAM_DECAY = 0.9;
const float ADAM_SQUARE_DECAY = 0.999;

void adam_means(float gradient, inout float mean, inout float square) {
    mean = mix(gradient, mean, ADAM_DECAY);
    square = mix(gradient * gradient, square, ADAM_SQUARE_DECAY);
}

void adam_means(vec3 gradient, inout vec3 mean, inout vec3 square) {
    mean = mix(gradient, mean, ADAM_DECAY);
    square = mix(gradient * gradient, square, ADAM_SQUARE_DECAY);
}

// What means are divided by after `steps`, for the mean and for the square.
vec2 adam_corrections(uint steps) {
    return 1.0 - vec2(pow(ADAM_DECAY, float(steps)), pow(ADAM_SQUARE_DECAY, float(steps)));
}

// A step at a rate, with the reciprocals of the corrections as the host has made them.
float adam_step(float rate, float mean, float square, vec2 reciprocals, float epsilon) {
    return rate * mean * reciprocals.x / (sqrt(square * reciprocals.y) + epsilon);
}
