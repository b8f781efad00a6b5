// Draws the touches of a skin. It needs the TUIO client for Processing (TUIO_Processing.zip from
// https://tuio.org, unpacked into the sketchbook's folder "libraries"). Start this sketch, then
//
//   eitskin stream --device sim:two_touch --to tuio://127.0.0.1
//
// TUIO gives places from 0 to 1 in the skin's bounding box, y downwards, and an id for each touch.
import TUIO.*;

TuioProcessing client;

void setup() {
  size(600, 600);
  client = new TuioProcessing(this); // port 3333
}

void draw() {
  background(255);
  fill(0);
  for (TuioCursor touch : client.getTuioCursorList()) {
    ellipse(touch.getScreenX(width), touch.getScreenY(height), 30, 30);
    text(touch.getCursorID(), touch.getScreenX(width) + 20, touch.getScreenY(height));
  }
}
